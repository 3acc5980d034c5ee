"""Settings shared by the tests of effects."""

from tests.shared.stages import without_stages

from basecal.accuracy.stages.concluding import find_error_at_task

no_error_at_task = without_stages(find_error_at_task)
