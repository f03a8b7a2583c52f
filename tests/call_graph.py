"""The worst stack of a program, from the call graphs that GCC writes with -fcallgraph-info=su (files .ci)."""

import collections
import re


def call_graph(files):
    """Frame bytes by function, the functions whose frame has no bound, and who calls whom."""
    frame, dynamic, calls = {}, set(), collections.defaultdict(set)
    for path in files:
        text = path.read_text()
        for title, label in re.findall(r'node: \{ title: "([^"]*)" label: "([^"]*)"', text):
            size = re.search(r"\\n(\d+) bytes \((\w+(?:,\w+)?)\)", label)
            if size:
                frame[title] = int(size[1])
                if size[2] not in ("static", "dynamic,bounded"):
                    dynamic.add(title)
        for source, target in re.findall(r'edge: \{ sourcename: "([^"]*)" targetname: "([^"]*)"', text):
            calls[source].add(target)
    return frame, dynamic, calls


def deepest(frame, calls):
    """Largest stack along any chain of calls with that chain, and the cycles met."""
    best, cycles, path = {}, [], []

    def visit(function):
        if function in best:
            return best[function]
        if function in path:
            cycles.append(" -> ".join(path[path.index(function):] + [function]))
            return 0, [function]
        path.append(function)
        below = max((visit(callee) for callee in calls.get(function, ())), default=(0, []), key=lambda found: found[0])
        path.pop()
        best[function] = frame.get(function, 0) + below[0], [function] + below[1]
        return best[function]

    total = max((visit(function) for function in sorted(frame)), default=(0, []), key=lambda found: found[0])
    return total, cycles
