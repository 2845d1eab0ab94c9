"""Trees of BehaviorTree.CPP's XML, written in our language: a converter to text, and its report."""
