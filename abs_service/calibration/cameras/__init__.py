"""Reports and verification of solved cameras."""
