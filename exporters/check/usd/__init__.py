"""Rules for USD: what UsdValidation 26.11 does not look at, and what it does in the same words."""
