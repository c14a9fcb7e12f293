"""How the command line explains itself: commands in groups, an example of each, what a misspelt one may mean."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from typing import NoReturn

from attrito.support.near import nearest

# Groups of commands, in the order of the work; each command with an example
GROUPS: dict[str, dict[str, str]] = {
    "model": {
        "import": "attrito import model.h5 --calculix job --mesh job.inp",
        "reduce": "mpirun -n 2 attrito reduce job.toml",
    },
    "solve": {
        "run": "mpirun -n 2 attrito run job.toml --set 'contact_set[*].friction_coefficient=0.3'",
        "peak": "attrito peak job.toml --set peak.start=1.0 --set peak.stop=4.0",
        "linear-modes": "attrito linear-modes job.toml --state stuck",
        "mode": "attrito mode job.toml --set mode.start=1e-4 --set mode.stop=1e-2",
        "campbell": "attrito campbell job.toml",
        "integrate": "attrito integrate job.toml --set integrate.frequency_hz=132",
    },
    "inspect": {
        "table": "attrito table result.h5 --contacts -o contacts.csv",
        "plot": "attrito plot before.h5 after.h5 --log -o compared.pdf",
        "report": "attrito report result.h5",
        "export": "attrito export result.h5 --points 12 --phases 24",
        "stress": "attrito stress result.h5 --set root",
        "info": "attrito info rom.h5",
        "keys": "attrito keys contact_set",
    },
    "study": {
        "study": "mpirun -n 4 attrito study study.toml",
        "fit": "attrito fit fit.toml",
        "optimise": "attrito optimise optimum.toml",
    },
    "evidence": {
        "chart": "attrito chart job.toml --seconds 10",
        "verify": "attrito verify paper --output out/paper",
    },
}
EXAMPLES = {name: example for group in GROUPS.values() for name, example in group.items()}
INDENT, WIDTH = 2, 14


class Parser(argparse.ArgumentParser):
    """Of a command or of all; what is not a command is named with the nearest that is."""

    def format_help(self) -> str:
        """Usage, description, options and what follows; commands are listed by what follows, in groups."""
        if self._subparsers is None:
            return super().format_help()
        formatter = self._get_formatter()
        formatter.add_usage(self.usage, self._actions, self._mutually_exclusive_groups)
        formatter.add_text(self.description)
        for group in self._action_groups:
            if group is not self._subparsers:
                formatter.start_section(group.title)
                formatter.add_arguments(group._group_actions)
                formatter.end_section()
        formatter.add_text(self.epilog)
        return formatter.format_help()

    def error(self, message: str) -> NoReturn:
        """End with the usage and one message, exit code 2."""
        misspelt = re.search(r"argument command: invalid choice: '([^']*)'", message)
        if misspelt:
            near = nearest(misspelt[1], EXAMPLES)
            meant = f"; do you mean {near!r}?" if near else ""
            message = f"no command {misspelt[1]!r}{meant} (attrito --help lists all)"
        super().error(message)


def in_groups(what: Mapping[str, str]) -> str:
    """The commands and what each does, group by group."""
    lines = []
    for group, names in GROUPS.items():
        lines += [f"{group}:", *(f"{'':{INDENT}}{name:{WIDTH}}{what[name]}" for name in names)]
    return "\n".join(lines)


def example(name: str) -> str:
    """An example of a command, for the end of its help."""
    return f"example:\n  {EXAMPLES[name]}"
