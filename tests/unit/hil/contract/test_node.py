"""An inbox: what is new since the last step, and the newest message of each topic."""

from hil.contract.node import Inbox


def test_taken_inbox_holds_what_was_new_and_sees_nothing_later():
    inbox = Inbox(("t", "u"))
    inbox.put("t", 1)
    inbox.put("t", 2)
    taken = inbox.taken()
    inbox.put("t", 3)
    inbox.put("u", 4)
    assert (taken.new("t"), taken.latest("t"), taken.new("u"), taken.latest("u")) == ([1, 2], 2, [], None)
    assert (inbox.new("t"), inbox.latest("t"), inbox.new("u")) == ([3], 3, [4])
    inbox.clear()
    assert (inbox.new("t"), inbox.latest("t"), taken.new("t")) == ([], 3, [1, 2])


def test_newest_messages_stay_in_an_inbox_whose_new_ones_were_taken():
    inbox = Inbox(("t",))
    inbox.put("t", 1)
    inbox.taken()
    assert (inbox.new("t"), inbox.latest("t"), inbox.taken().latest("t")) == ([], 1, 1)
