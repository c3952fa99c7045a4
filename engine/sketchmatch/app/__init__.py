"""Requests of the contract, admitted, done somewhere and followed; no transport is known here."""
