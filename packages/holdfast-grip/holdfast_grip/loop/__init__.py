"""The grip loop on a hand: from estimates to commands, with watchdog and log."""
