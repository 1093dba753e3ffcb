"""Results that several callers of one frame ask for."""

from abs_service.tracker.memo import Memo


def test_a_result_is_computed_once_and_one_that_is_there_already_never():
    asked: list[str] = []

    def length(key: str) -> int:
        asked.append(key)
        return len(key)

    memo = Memo({"known": 0})
    assert [memo.get(key, length) for key in ("known", "ab", "abc", "ab", "known")] == [0, 2, 3, 2, 0]
    assert asked == ["ab", "abc"]
