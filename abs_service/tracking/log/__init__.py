"""The estimates of a tracker as others follow them: text, shares of the sensors, comparison with the truth."""
