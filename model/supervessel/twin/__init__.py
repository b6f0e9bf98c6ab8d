"""What the twin offers for control: checked functions, errors of attitude, linear models, generated C."""
