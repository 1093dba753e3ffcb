"""The wire format of abs-service; `.proto` sources with the generated code beside them."""
