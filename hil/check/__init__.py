"""Field checklists: lists in TOML, checks that read the rig, a record that survives a crash, and three outputs."""
