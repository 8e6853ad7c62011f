"""Jobs: what the commands, a batch and a web page call alike."""
