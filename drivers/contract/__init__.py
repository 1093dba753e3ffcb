"""The device contract: frames, controls, capabilities, clocks, errors."""
