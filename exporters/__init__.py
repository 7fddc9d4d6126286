"""The numpy side: a `Clip` and the files it is written to. Imports neither torch nor animator."""
