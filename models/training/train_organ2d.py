#!/usr/bin/python3
"""Trains organ2d: see README.md beside this file."""

from pictures import train

from network import Organ2d

if __name__ == "__main__":
    train(Organ2d)
