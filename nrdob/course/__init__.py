"""What teaches: the ledger of the paper's claims, and the graded problem sets."""
