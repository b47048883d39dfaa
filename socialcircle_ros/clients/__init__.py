"""What talks to a node from outside: process, player, recorder, remote parameters."""
