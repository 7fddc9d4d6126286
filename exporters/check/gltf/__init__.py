"""Rules for glTF 2.0, on a reader of its own: json and numpy, nothing of the writer."""
