"""What the paper did not ask: methods, events, errors, sensitivities, real recordings."""
