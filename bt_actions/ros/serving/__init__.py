"""What a server offers on a node, with callbacks for what it decides. Knows nothing of trees."""
