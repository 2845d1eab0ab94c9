"""Drives all goals of a process, over protocols that ros/ and testing/ implement.

What there is stands in state.py: a process (`Host`) has ROS domains, a domain has the endpoints of
all nodes, an endpoint has goals on their way (`GoalHandle`), and each of those has one `Goal` of
goals/. All else is functions over it, which wait for nothing, read no clock and have no thread; the
host's lock is held. The world comes in at four places:

    a leaf          Traffic.begin, .advance, .interrupt      traffic.py
    a server        ActionEndpoint.answer_came and others    endpoint.py, called by a transport
    time            ActionEndpoint.run_due                   endpoint.py, called by the scheduler
    a run that ends Drain                                    drain.py

A goal goes out, and a reply comes back, through these functions, in this order:

    Traffic.begin     driver.take_in, driver.tell(GRANTED)
    Traffic.advance   driver.apply_deadlines, watcher.recent_state, admission.finds_server and
                      .is_clear, driver.tell(SERVER_READY): Goal.on, driver._send, transport.send
    answer_came       Replies.weigh_answer, driver.tell_believed, driver.tell: Goal.on, and what
                      follows from that in driver._do_in_order; when the goal is DONE, driver.retire

From below to above, each file imports those before it alone: transport.py, scheduler.py, state.py,
cancel_queue.py, route.py (sees, asks and hears a server), admission.py (may a goal be sent?),
driver.py (tells goals, and does what they decide), handover.py (goals go to another endpoint),
watcher.py (looks at a server), endpoint.py, drain.py, traffic.py, and, for other rooms, backend.py.
"""
