"""How good a run was: measured per frame, shown as pictures, JSON and HTML."""
