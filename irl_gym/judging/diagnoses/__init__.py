"""What can be wrong with a learned reward: one function for each sentence, each from a `Case` to a `Finding` or None.

`irl_gym.judging.diagnoses.doctor.doctor` asks them all, in order of importance.
"""
