"""What laboratories use today for the same fit, beside which scripts/bench puts ours."""
