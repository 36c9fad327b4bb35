"""HiGHS that prints nothing: from 1.16 on it prints its name and licence where callbacks are enabled, which `Highs()` does."""

import highspy


class SilentHighs(highspy.Highs):
    """HiGHS whose log is off before anything is done with it."""

    def enableCallbacks(self) -> None:
        """Enable what is called while it works; `Highs.__init__` calls this first of all."""
        self.setOptionValue("output_flag", False)
        super().enableCallbacks()
