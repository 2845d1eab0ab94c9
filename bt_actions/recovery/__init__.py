"""After a process was killed: what it left running, and cleaning that up."""
