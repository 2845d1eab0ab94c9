"""The drive of all goals of a process, over protocols that ros/ and testing/ implement.

state.py holds the data: a process (`Host`) has ROS domains, a domain has the endpoints of all
nodes, an endpoint has goals on their way (`GoalHandle`), and each handle has one `Goal` of goals/.
All other files are functions over that data. The functions never wait, read no clock and have no
thread; their caller holds the host's lock. Calls from outside come in at four places:

    a leaf          Traffic.begin, .advance, .interrupt      traffic.py
    a server        ActionEndpoint.answer_came and others    endpoint.py, called by a transport
    time            ActionEndpoint.run_due                   endpoint.py, called by the scheduler
    a run that ends Drain                                    drain.py

A goal goes out, and a reply comes back, through these functions, in this order:

    Traffic.begin     driver.take_in, driver.tell(GRANTED)
    Traffic.advance   driver.apply_deadlines, watcher.recent_state, admission.finds_server and
                      .is_clear, driver.tell(SERVER_READY): Goal.on, driver._send, transport.send
    answer_came       Replies.weigh_answer, driver.tell_believed, driver.tell: Goal.on, then the
                      effects in driver._do_in_order; when the goal is DONE, driver.retire

From below to above, each file imports only earlier files: transport.py, stalls.py (a process that
stood still), scheduler.py, state.py, cancel_queue.py, route.py (how an endpoint sees, asks and
hears its server), admission.py (whether a goal may be sent), driver.py (events to goals, and the
commands of goals), handover.py (goals go to another endpoint), watcher.py (the looks at a server),
endpoint.py, drain.py, traffic.py, and, for other rooms, backend.py.
"""
