"""Check of a stored calibration against new views, with identification of a sensor that has moved.

Board poses are estimated anew, everything else is fixed. Three questions are answered: does each camera fit its own
corners; has a pair of sensors moved relative to each other by more than the stored and new covariances allow; and which
single sensor, with a free pose, removes the residuals.
"""
