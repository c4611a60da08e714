/* One versioned token among NODES machines: the model of TokenBook (authority.py), checked by SPIN.
 *
 * The bus is the worst that loses nothing for ever: whatever was said once may be heard by any machine at any later time,
 * any number of times, in any order, or never. That covers omission, duplicates, delay, reordering and stale frames.
 * Machines crash between any two effects and start again from their journal, CRASHES times in all.
 *
 * Variants: SEND_FIRST plants a bug, the frame before the journal write. LIVE takes frames off the bus, LOSSES times,
 * and asks whether a requested token moves once that is over; ONE_GRANT plants a bug there, a grant never repeated.
 * TRACE leaves out the processes: what a run of the controllers did is then a sequence of these same steps, and a step that the model does not have blocks.
 * Not modelled: versions that wrap, and a journal that is lost or torn.
 */
#ifndef NODES
#define NODES 3
#endif
#ifndef VERSIONS
#define VERSIONS 4
#endif
#ifndef CRASHES
#define CRASHES 2
#endif
#ifndef LOSSES
#define LOSSES 2
#endif

/* What a machine has yet to carry out of its last decision; the decision itself has changed its memory already. */
#define IDLE 0
#define GIVE_RECORD 1
#define GIVE_SEND 2
#define TAKE_RECORD 3
#define TAKE_SEND 4
#define GONE_RECORD 5
#define DOWN 6

#define AT(version, node) ((version) * NODES + (node))
#define NEWS(n, version) ((version) > seen[n])

byte todo[NODES];
/* Memory: whether it holds the token, the newest version seen, and the grant that its receiver has not confirmed. */
bool holds[NODES];
byte seen[NODES];
byte leaving[NODES];
byte receiver[NODES];
/* The journal: the same, as far as written. */
bool kept_holds[NODES];
byte kept_seen[NODES];
byte kept_leaving[NODES];
byte kept_receiver[NODES];
/* The bus: grants of a version to a machine, statements of holding a version. */
bool granted[AT(VERSIONS + 1, 0)];
bool stated[AT(VERSIONS + 1, 0)];
/* The newest version that anybody gave, by its journal: whoever asks can hear of it. */
byte newest;
byte crashes;
byte losses;

byte other_;
/* Never two who both believe. A machine that is down believes nothing until it starts again. */
inline alone(n) {
    other_ = 0;
    do
    :: other_ < NODES -> assert(other_ == n || !holds[other_]); other_++
    :: other_ >= NODES -> break
    od;
    other_ = 0
}

inline give(n, to) {
    atomic {
        todo[n] == IDLE && holds[n] && seen[n] < VERSIONS && n != to;
        holds[n] = false; seen[n] = seen[n] + 1; leaving[n] = seen[n]; receiver[n] = to;
#ifdef SEND_FIRST
        todo[n] = GIVE_SEND
#else
        todo[n] = GIVE_RECORD
#endif
    }
}

inline record_given(n) {
    atomic {
        todo[n] == GIVE_RECORD;
        kept_holds[n] = false; kept_seen[n] = seen[n]; kept_leaving[n] = leaving[n]; kept_receiver[n] = receiver[n];
        newest = seen[n];
#ifdef SEND_FIRST
        todo[n] = IDLE
#else
        todo[n] = GIVE_SEND
#endif
    }
}

inline send_grant(n) {
    atomic {
        todo[n] == GIVE_SEND;
        granted[AT(leaving[n], receiver[n])] = true;
#ifdef SEND_FIRST
        todo[n] = GIVE_RECORD
#else
        todo[n] = IDLE
#endif
    }
}

inline grant_again(n) {
    atomic { todo[n] == IDLE && leaving[n] != 0; granted[AT(leaving[n], receiver[n])] = true }
}

inline accept(n, version) {
    atomic {
        todo[n] == IDLE && granted[AT(version, n)] && NEWS(n, version);
        holds[n] = true; seen[n] = version; leaving[n] = 0; receiver[n] = 0; todo[n] = TAKE_RECORD;
        alone(n)
    }
}

inline record_held(n) {
    atomic {
        todo[n] == TAKE_RECORD;
        kept_holds[n] = true; kept_seen[n] = seen[n]; kept_leaving[n] = 0; kept_receiver[n] = 0; todo[n] = TAKE_SEND
    }
}

inline state_held(n) {
    atomic { todo[n] == TAKE_SEND; stated[AT(seen[n], n)] = true; todo[n] = IDLE }
}

inline state_again(n) {
    atomic { todo[n] == IDLE && holds[n] && seen[n] > 0; stated[AT(seen[n], n)] = true }
}

/* The receiver said that it holds the token, or gave it on: what nobody can who did not have it. */
inline confirmed(n) {
    atomic {
        todo[n] == IDLE && leaving[n] != 0 && (stated[AT(leaving[n], receiver[n])] || newest > leaving[n]);
        leaving[n] = 0; receiver[n] = 0; todo[n] = GONE_RECORD
    }
}

inline record_gone(n) {
    atomic {
        todo[n] == GONE_RECORD;
        kept_holds[n] = false; kept_seen[n] = seen[n]; kept_leaving[n] = 0; kept_receiver[n] = 0; todo[n] = IDLE
    }
}

inline crash(n) {
    atomic {
        todo[n] != DOWN && crashes < CRASHES;
        crashes++; holds[n] = false; seen[n] = 0; leaving[n] = 0; receiver[n] = 0; todo[n] = DOWN
    }
}

inline restart(n) {
    atomic {
        todo[n] == DOWN;
        holds[n] = kept_holds[n]; seen[n] = kept_seen[n]; leaving[n] = kept_leaving[n]; receiver[n] = kept_receiver[n];
        todo[n] = IDLE;
        if
        :: holds[n] -> alone(n)
        :: else
        fi
    }
}

/* What a run's controller remembers after a step is what the model remembers. */
inline expect(n, is_holder, version, outgoing) {
    (holds[n] == is_holder && seen[n] == version && leaving[n] == outgoing)
}

#ifndef TRACE

#ifdef LIVE
/* Machine 1 asks; only a holder that heard the request gives, and only to machine 1. */
bool asked;
#define GIVES(to) (asked && to == 1)
#else
#define GIVES(to) true
#endif

/* What a machine does by itself. What is on the bus already is not said again: a step without effect would be a loop. */
proctype machine(byte n) {
end:
    do
    :: record_given(n)
    :: send_grant(n)
    :: record_held(n)
    :: state_held(n)
    :: record_gone(n)
    :: confirmed(n)
#ifndef ONE_GRANT
    :: atomic { leaving[n] != 0 && !granted[AT(leaving[n], receiver[n])] && todo[n] == IDLE -> grant_again(n) }
#endif
    :: atomic { holds[n] && seen[n] > 0 && !stated[AT(seen[n], n)] && todo[n] == IDLE -> state_again(n) }
#ifdef LIVE
    :: atomic { n == 1 && !holds[1] && todo[1] == IDLE && !asked -> asked = true }
#else
    :: crash(n)
    :: restart(n)
#endif
    od
}

/* What it may give to another, and what it hears of each version: processes of their own, so that SPIN's fairness, which
 * counts processes, is fair to each frame. */
proctype giving(byte n, to) {
end:
    do
    :: atomic { GIVES(to) && todo[n] == IDLE && holds[n] && seen[n] < VERSIONS -> give(n, to) }
    od
}

proctype accepting(byte n, version) {
end:
    do
    :: accept(n, version)
    od
}

#ifdef LIVE
proctype noise() {
    byte v, m;
    do
    :: atomic { losses < LOSSES -> select(v : 1 .. VERSIONS); select(m : 0 .. NODES - 1);
                granted[AT(v, m)] = false; stated[AT(v, m)] = false; asked = false; losses++; v = 0; m = 0 }
    :: losses >= LOSSES -> break
    od
}
ltl moves { <> holds[1] }
#endif

init {
    byte i, j, v;
    atomic {
        holds[0] = true; kept_holds[0] = true;
        for (i : 0 .. NODES - 1) {
            run machine(i);
            for (j : 0 .. NODES - 1) {
                if
                :: i != j ->
                    run giving(i, j)
                :: else ->
                    for (v : 1 .. VERSIONS) { run accepting(i, v) }
                fi
            }
        }
#ifdef LIVE
        run noise()
#endif
    }
}
#endif
