"""Sites from the files of others: maps and tasks of the MAPF community, openTCS plant models, Open-RMF buildings."""
