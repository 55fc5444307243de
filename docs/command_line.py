# SPDX-License-Identifier: Apache-2.0
"""usage: command_line.py BILAYER: prints docs/command-line-options.md, from the --help of the program BILAYER."""

import re
import subprocess
import sys


def help_of(program, *command):
    result = subprocess.run([program, *command, "--help"], capture_output=True, text=True, check=True)
    return "\n".join(line.rstrip() for line in result.stdout.strip().splitlines()).replace(program, "bilayer")


def page(program):
    general = help_of(program)
    commands = re.findall(r"^  (\w+) ", general.split("Subcommands:\n")[1], re.M)
    parts = ["# Options of the command line\n",
             "Written by `docs/command_line.py` from `bilayer --help`. [command-line.md](command-line.md) shows the commands at work.\n"
             "`bilayer-mpi build` has the options of `bilayer build` ([tiles](tiles.md)).\n",
             f"```\n{general}\n```\n"]
    parts += [f"## `bilayer {command}`\n\n```\n{help_of(program, command)}\n```\n" for command in commands]
    return "\n".join(parts)


if __name__ == "__main__":
    print(page(sys.argv[1]), end="")
