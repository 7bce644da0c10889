"""The training environment as Gymnasium environments; importing this package registers `PerchHil/Perch-v0`.

gymnasium.make("policies.gym:PerchHil/Perch-v0", stage="state", airframe="paper_quad")
gymnasium.make_vec("policies.gym:PerchHil/Perch-v0", num_envs=1024, stage="vision")
"""

try:
    import gymnasium
except ImportError:
    raise ImportError("Gymnasium is not installed: pip install 'perch-hil[gym]'") from None

ID = "PerchHil/Perch-v0"

gymnasium.register(
    id=ID,
    entry_point="policies.gym.single:PerchEnv",
    vector_entry_point="policies.gym.vector:PerchVectorEnv",
)
