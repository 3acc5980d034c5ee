"""What tests of reports share."""

from tests.shared.stages import without_stages

from basecal.accuracy.stages.solving import screen_conventions

no_conventions = without_stages(screen_conventions)  # skips the search for mistakes, which correct cells lack
