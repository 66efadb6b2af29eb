"""Rules that propose labels from evidence, for a person to check."""




