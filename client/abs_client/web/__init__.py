"""Estimates for JavaScript, in a browser or elsewhere: `python -m abs_client.web`."""
