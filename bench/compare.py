#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Compares the ratios to rivals of two runs of a benchmark, written by its option --ratios."""
import argparse
import json
import statistics
import sys


def read(path):
    """Returns the file's content. Ends the program with one line if it is no file of ratios."""
    try:
        with open(path, encoding="utf-8") as file:
            content = json.load(file)
        ratios = content["ratios"]
        if not all(isinstance(value, (int, float)) for values in ratios.values() for value in values):
            raise ValueError("a ratio is not a number")
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        sys.exit(f"bench compare: {path} is not a file that a benchmark wrote by --ratios: {error}")
    content["ratios"] = {name: sorted(values) for name, values in ratios.items() if values}
    return content


def quartiles(values):
    """Returns the lower quartile, the median and the upper quartile."""
    if len(values) == 1:
        return values[0], values[0], values[0]
    return tuple(statistics.quantiles(values, n=4, method="inclusive"))


def verdict(old, new, tolerance):
    """A change counts if the medians differ by more than the tolerance and the middle halves of the rounds are apart."""
    change = new[1] / old[1] - 1
    if change < -tolerance and new[2] < old[0]:
        return "loss"
    if change > tolerance and new[0] > old[2]:
        return "gain"
    return ""


def spread(of):
    return f"{of[1]:.2f} ({of[0]:.2f} to {of[2]:.2f})"


def main():
    parser = argparse.ArgumentParser(prog="bench compare", description=__doc__)
    parser.add_argument("old", help="file of the older run")
    parser.add_argument("new", help="file of the newer run")
    parser.add_argument("--tolerance", type=float, default=0.05,
                        help="a change of the median that is smaller counts as none (default: 0.05, which is 5 %%)")
    options = parser.parse_args()
    if not 0 <= options.tolerance < 1:
        parser.error(f"--tolerance is {options.tolerance:g}, but it must be at least 0 and less than 1")
    old, new = read(options.old), read(options.new)
    if old["benchmark"] != new["benchmark"]:
        sys.exit(f"bench compare: {options.old} is of bench {old['benchmark']}, {options.new} of bench {new['benchmark']}")
    common = [name for name in old["ratios"] if name in new["ratios"]]
    if not common:
        sys.exit("bench compare: the two files have no measurement in common")
    if old["processor"] != new["processor"]:
        print(f"Different processors: {old['processor']}, {new['processor']}. Ratios depend on them, too.\n")
    print("Times as fast as the rival: median (lower to upper quartile of the rounds)\n")
    print("| | old | new | new / old | |\n|---|---|---|---|---|")
    losses = 0
    for name in common:
        before, after = quartiles(old["ratios"][name]), quartiles(new["ratios"][name])
        word = verdict(before, after, options.tolerance)
        losses += word == "loss"
        print(f"| {name} | {spread(before)} | {spread(after)} | {after[1] / before[1]:.2f} | {word} |")
    for missing in sorted(set(old["ratios"]) ^ set(new["ratios"])):
        print(f"Only in the {'old' if missing in old['ratios'] else 'new'} run: {missing}")
    changes = [quartiles(new["ratios"][name])[1] / quartiles(old["ratios"][name])[1] for name in common]
    print(f"\nGeometric mean of new / old: {statistics.geometric_mean(changes):.3f}; {losses} of {len(common)} lost")
    sys.exit(3 if losses else 0)


if __name__ == "__main__":
    main()
