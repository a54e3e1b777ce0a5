"""From tracked runs to tables: reports of sweeps, beside what was published."""
