"""Live deformation tracking from depth and colour cameras by analysis by synthesis."""

__version__ = "0.1.0"
