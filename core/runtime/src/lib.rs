//! Recipes, plans, runs and the command line of SynTable.
