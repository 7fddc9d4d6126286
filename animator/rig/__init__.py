"""From solved anchors to joints: the bake is the only file that knows both packages."""
