"""Package ``sketchmatch.v1`` of the contract. Everything beside this file is generated."""
