"""From YAML nodes to documents: their nodes, the files they name, and their inputs."""
