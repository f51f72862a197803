"""How much each parameter of a step matters: each is changed alone, and figures are compared with the truth."""
