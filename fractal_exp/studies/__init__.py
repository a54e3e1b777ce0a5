"""What a fit is worth (`judging`), and reports of sweeps: tables of tracked runs, beside published figures."""
