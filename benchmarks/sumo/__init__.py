"""Driver models of Eclipse SUMO as a benchmark: identification, diagnosis and rivals on drivers that nobody here wrote."""
