"""The monitor's topics about a state: their order, and a bit for each."""

MATRICES = ("mass_matrix_factors", "joint_space_dynamics")
"""Topics that are not made of the evaluation of a state."""


ORDER = ("kinetic_energy", "state", "total_joint_rates", "working_moments", "coriolis", *MATRICES)
"""What is watched for safety goes out first, matrices last."""


BITS = {topic: 1 << k for k, topic in enumerate(ORDER)}
"""A bit for each topic, where several of them are told of by one number."""


ABOUT_STATE, WITH_LINK_ENERGY = sum(BITS[topic] for topic in ORDER if topic not in MATRICES), BITS["kinetic_energy"]
"""Those of topics that are made of the evaluation of a state; and that of the one that says the energy of each link."""
