"""Monitors of a running tracker: loss of the object, growth of the mesh, consistency of the noise models."""
