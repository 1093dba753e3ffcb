"""Statistics of static sequences of a depth sensor: input of noise model selection."""
