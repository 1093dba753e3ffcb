"""Child processes of a rig: started, forked or ended, with a watchdog in each that notices the end of its parent."""
