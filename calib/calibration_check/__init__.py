"""Whether a stored calibration still explains what its sensors see, and if not, which sensor has moved.

Boards are placed anew, everything else stays as it was stored. Three questions: does each camera explain its own
corners; has a pair of sensors moved relative to each other, by more than the stored and the new covariance allow; and
which single sensor, set free, explains it all.
"""
