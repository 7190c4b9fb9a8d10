"""Identification of a solenoid valve from measured voltage and current, [UKF] Section III."""
