#!/usr/bin/python3
"""Trains relief2d: see README.md beside this file."""

from pictures import train

from network import Relief2d

if __name__ == "__main__":
    train(Relief2d)
