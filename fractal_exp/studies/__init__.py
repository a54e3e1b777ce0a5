"""Reports of sweeps: tables of tracked runs, beside published figures."""
