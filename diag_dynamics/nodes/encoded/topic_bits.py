# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor's topics about a state as numbers: a bit for each, where several of them are told of at once.

Kernels take bits as arguments. One that had them compiled in would go stale when the list of topics changes.
"""

from diag_dynamics.nodes.support.topics import TOPICS

MATRICES = tuple(topic.name for topic in TOPICS if topic.matrix)
"""Topics that are not made of the evaluation of a state."""

ORDER = (*(topic.name for topic in TOPICS if not topic.matrix and not topic.beside), *MATRICES)
"""All of them, in the order in which they go out: matrices last."""

BITS = {topic: 1 << k for k, topic in enumerate(ORDER)}
"""A bit for each topic."""

ABOUT_STATE, WITH_LINK_ENERGY = sum(BITS[topic] for topic in ORDER if topic not in MATRICES), BITS["kinetic_energy"]
"""Those of topics that are made of the evaluation of a state; and that of the one that says the energy of each link."""
