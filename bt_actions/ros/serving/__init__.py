"""The offers of a server on a node, with callbacks for all decisions. Knows nothing of trees."""
