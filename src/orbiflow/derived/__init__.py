"""Three operations with their settings, as examples until the rooms have their own."""
