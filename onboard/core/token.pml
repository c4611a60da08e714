/* One versioned token among NODES machines: the model of TokenBook (authority.py), checked by SPIN.
 *
 * The bus is the worst that loses nothing for ever: whatever was said once may be heard by any machine at any later time,
 * any number of times, in any order, or never. That covers omission, duplicates, delay, reordering and stale frames.
 * Machines crash between any two effects and start again from their journal, CRASHES times in all.
 *
 * Variants: SEND_FIRST plants a bug, the frame before the journal write. LIVE takes frames off the bus, LOSSES times,
 * and asks whether a requested token moves once that is over; ONE_GRANT plants a bug there, a grant never repeated; with
 * MISSED machine 1 has missed how the token came to where it is, and NO_ANSWER plants a bug: disputes are not answered.
 * TRACE leaves out the processes: what a run of the controllers did is then a sequence of these same steps, and a step that the model does not have blocks.
 *
 * Rules that can be left out, each a macro that makes two holders or loses the token:
 * GHOST: a foreign node says that it gives any version to anybody, and that it holds the token. A machine takes a grant
 *   from whom it believes to hold (left out: GULLIBLE), and what it holds leaves by its own hand (left out: MEEK).
 * OLD_COPY: once a machine starts from an old copy of its journal, while all others live. It asks them what they know
 *   (left out: NO_WITNESS), and where they know newer it stands for a person.
 * REGENERATE: a person has the rights of a machine that is down made anew. All are frozen meanwhile (left out: NO_FREEZE),
 *   the version is above every one known, leaving grants too (left out: NOT_ABOVE), and of all in line (left out:
 *   ONE_ABOVE), and the machine that was declared
 *   lost stays out under its old epoch if it comes back (left out: NO_EPOCH).
 * FIRST_OF_RUN: a token that goes in a run gets the version after that of the first of the run, which may not be newer.
 * SERIAL: versions of 3 bits that wrap, as they did once: a rule left out for good.
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
#define STANDS 7

#define AT(version, node) ((version) * NODES + (node))
#ifdef SERIAL
#define NEXT(version) (((version) + 1) & 7)
#define NEWS(n, version) ((((version) - seen[n]) & 7) > 0 && (((version) - seen[n]) & 7) < 4)
#define MAY_GIVE(n, version) ((version) == NEXT(seen[n]))
#else
#define NEXT(version) ((version) + 1)
#define NEWS(n, version) ((version) > seen[n])
/* Of a token that goes in a run the version is one more than the highest of the run: newer than its own by JUMP at most.
 * The first's and one more is not newer than each (FIRST_OF_RUN). */
#ifndef JUMP
#ifdef TRACE
#define JUMP VERSIONS
#else
#define JUMP 2
#endif
#endif
#ifdef FIRST_OF_RUN
#define MAY_GIVE(n, version) ((version) > 0 && (version) <= VERSIONS)
#else
#define MAY_GIVE(n, version) ((version) > seen[n] && (version) <= seen[n] + JUMP && (version) <= VERSIONS)
#endif
#endif
#define NOBODY NODES
/* A grant of this version comes from whom n believes to hold; a trace knows nothing of beliefs. */
#if defined(GULLIBLE) || defined(TRACE) || !defined(BELIEFS)
#define FROM_HOLDER(n, version) true
#else
#define FROM_HOLDER(n, version) (giver[version] == believed[n])
#endif
#ifdef REGENERATE
#define FREE (!frozen)
#else
#define FREE true
#endif
/* A machine of an older epoch is an obstacle. */
#if defined(REGENERATE) && !defined(NO_EPOCH)
#define OF_THIS_EPOCH(n) (lost_one != n)
#else
#define OF_THIS_EPOCH(n) true
#endif

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
#if defined(BELIEFS) && !defined(TRACE)
/* Who gave each version, whom each machine believes to hold, and to whom it gave last, from its journal. */
byte giver[VERSIONS + 1];
byte believed[NODES];
byte given_to[NODES];
#endif
#ifdef OLD_COPY
bool has_copy;
byte copied;
bool copy_holds;
byte copy_seen;
byte copy_leaving;
byte copy_receiver;
bool restored;
#endif
#ifdef REGENERATE
bool frozen;
bool regenerated;
byte lost_one;
byte maximum;
#endif
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

/* The token is with somebody, or on its way. */
inline somewhere() {
    other_ = 0;
    do
    :: other_ < NODES && (holds[other_] || leaving[other_] != 0) -> break
    :: other_ < NODES && !(holds[other_] || leaving[other_] != 0) -> other_++
    :: other_ >= NODES -> assert(false)
    od;
    other_ = 0
}

inline give(n, to, version) {
    atomic {
        todo[n] == IDLE && holds[n] && MAY_GIVE(n, version) && n != to && FREE;
        holds[n] = false; seen[n] = version; leaving[n] = seen[n]; receiver[n] = to;
#if defined(BELIEFS) && !defined(TRACE)
        giver[seen[n]] = n; believed[n] = to; given_to[n] = to;
#endif
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
        todo[n] == IDLE && granted[AT(version, n)] && NEWS(n, version) && FROM_HOLDER(n, version) && FREE;
#if defined(BELIEFS) && !defined(TRACE)
        believed[n] = n;
#endif
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
        todo[n] != DOWN && todo[n] != STANDS && crashes < CRASHES;
        crashes++; holds[n] = false; seen[n] = 0; leaving[n] = 0; receiver[n] = 0; todo[n] = DOWN
    }
}

inline restart(n) {
    atomic {
        todo[n] == DOWN && OF_THIS_EPOCH(n);
        holds[n] = kept_holds[n]; seen[n] = kept_seen[n]; leaving[n] = kept_leaving[n]; receiver[n] = kept_receiver[n];
        todo[n] = IDLE;
        if
        :: holds[n] -> alone(n)
        :: else
        fi
    }
}

#ifdef BELIEFS
#ifndef TRACE
/* A grant of whom it believes, to another, is overheard. */
inline overhear(n, version, whom) {
    atomic {
        todo[n] == IDLE && !holds[n] && n != whom && granted[AT(version, whom)] && version > 0 && giver[version] == believed[n];
        believed[n] = whom
    }
}

/* It doubts a grant and asks whom it believes, who answers from its journal to whom it gave. */
inline ask(n) {
    atomic {
        todo[n] == IDLE && !holds[n] && believed[n] != n && todo[believed[n]] == IDLE && !holds[believed[n]] &&
            given_to[believed[n]] != NOBODY && given_to[believed[n]] != n;
        believed[n] = given_to[believed[n]]
    }
}
#endif
#endif

#ifdef OLD_COPY
/* Somebody keeps a copy of a machine's journal. */
inline copy_journal(n) {
    atomic {
        !has_copy;
        has_copy = true; copied = n; copy_holds = kept_holds[n]; copy_seen = kept_seen[n];
        copy_leaving = kept_leaving[n]; copy_receiver = kept_receiver[n]
    }
}

/* The machine starts from it while all others live; what was said before is heard no more. */
inline restore(n) {
    atomic {
        has_copy && !restored && copied == n && todo[n] == DOWN;
        other_ = 0;
        do
        :: other_ < NODES && (other_ == n || todo[other_] != DOWN) -> other_++
        :: else -> break
        od;
        if
        :: other_ < NODES -> other_ = 0
        :: else ->
            restored = true; other_ = 0;
            do
            :: other_ < AT(VERSIONS + 1, 0) -> granted[other_] = false; stated[other_] = false; other_++
            :: else -> break
            od;
            kept_holds[n] = copy_holds; kept_seen[n] = copy_seen; kept_leaving[n] = copy_leaving;
            kept_receiver[n] = copy_receiver;
            holds[n] = copy_holds; seen[n] = copy_seen; leaving[n] = copy_leaving; receiver[n] = copy_receiver;
            todo[n] = IDLE; other_ = 0;
#ifndef NO_WITNESS
            do
            :: other_ < NODES && seen[other_] > copy_seen && other_ != n -> holds[n] = false; todo[n] = STANDS; break
            :: other_ < NODES && !(seen[other_] > copy_seen && other_ != n) -> other_++
            :: other_ >= NODES -> break
            od;
#endif
            other_ = 0;
            if
            :: holds[n] -> alone(n)
            :: else
            fi
        fi
    }
}
#endif

#ifdef REGENERATE
/* A machine is down and a person says that it is lost. */
inline freeze(n) {
    atomic {
        todo[n] == DOWN && !frozen && !regenerated && lost_one == NOBODY;
        lost_one = n;
#ifndef NO_FREEZE
        frozen = true
#endif
    }
}

/* What all others hold, gave away or have under way is known: the maximum, and whether one of them has the token. */
inline collect(n) {
    atomic {
        n == 0 && lost_one != NOBODY && maximum == 0 && !regenerated;
        other_ = 0;
        do
        :: other_ < NODES && other_ != lost_one && (todo[other_] != IDLE || holds[other_]) -> break
#ifdef NOT_ABOVE
        :: other_ < NODES && (other_ == lost_one || (todo[other_] == IDLE && !holds[other_])) -> other_++
#else
        :: other_ < NODES && (other_ == lost_one || (todo[other_] == IDLE && !holds[other_])) ->
            if
            :: other_ != lost_one && seen[other_] > maximum -> maximum = seen[other_]
            :: else
            fi;
            other_++
#endif
        :: other_ >= NODES -> break
        od;
        if
        :: other_ < NODES -> maximum = 0
        /* What the lost one may have given unheard goes under a version above all in line with it. */
#ifdef ONE_ABOVE
        :: else -> maximum = maximum + 1
#else
        :: else -> maximum = maximum + JUMP
#endif
        fi;
        other_ = 0
    }
}

/* The token is assigned to n under the new epoch; everybody forgets what is older. */
inline commit(n) {
    atomic {
        maximum > 0 && !regenerated && n != lost_one && todo[n] == IDLE && maximum <= VERSIONS;
        regenerated = true; other_ = 0;
        do
        :: other_ < NODES && other_ != lost_one ->
            if
            :: seen[other_] < maximum -> seen[other_] = maximum; kept_seen[other_] = maximum
            :: else
            fi;
            leaving[other_] = 0; receiver[other_] = 0; kept_leaving[other_] = 0; kept_receiver[other_] = 0; other_++
        :: other_ == lost_one -> other_++
        :: other_ >= NODES -> break
        od;
        other_ = 0; holds[n] = true; kept_holds[n] = true; frozen = false; maximum = 0;
        alone(n)
    }
}
#endif

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
proctype giving(byte n, to, version) {
end:
    do
#ifdef SERIAL
    :: atomic { GIVES(to) && todo[n] == IDLE && holds[n] -> give(n, to, NEXT(seen[n])) }
#else
    :: atomic { GIVES(to) && todo[n] == IDLE && holds[n] && MAY_GIVE(n, version) -> give(n, to, version) }
#endif
    od
}

proctype accepting(byte n, version) {
end:
    do
    :: accept(n, version)
    od
}

#ifdef GHOST
/* A node that the site does not have says all that it can: its grants are believed by the gullible, its claims by the meek. */
proctype ghost(byte n, version) {
end:
    do
#ifdef GULLIBLE
    :: atomic {
        todo[n] == IDLE && NEWS(n, version) ->
        holds[n] = true; seen[n] = version; leaving[n] = 0; receiver[n] = 0; todo[n] = TAKE_RECORD;
        alone(n)
    }
#endif
#ifdef MEEK
    :: atomic {
        todo[n] == IDLE && holds[n] && NEWS(n, version) -> holds[n] = false; seen[n] = version; somewhere()
    }
#endif
    :: atomic { granted[AT(version, n)] && todo[n] == IDLE && holds[n] && NEWS(n, version) -> skip }
    od
}
#endif

#ifdef BELIEFS
proctype believing(byte n, version, whom) {
end:
    do
    :: overhear(n, version, whom)
    od
}

proctype asking(byte n) {
end:
    do
#ifndef NO_ANSWER
    :: ask(n)
#endif
    :: false
    od
}
#endif

#ifdef OLD_COPY
proctype medium(byte n) {
end:
    do
    :: copy_journal(n)
    :: restore(n)
    od
}
#endif

#ifdef REGENERATE
proctype operator(byte n) {
end:
    do
    :: freeze(n)
    :: collect(n)
    :: commit(n)
    od
}
#endif

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
#ifdef BELIEFS
        for (i : 0 .. NODES - 1) { given_to[i] = NOBODY }
#endif
#ifdef MISSED
        believed[1] = 2; given_to[2] = 0; seen[0] = 1; kept_seen[0] = 1;
#endif
#ifdef REGENERATE
        lost_one = NOBODY;
        for (i : 0 .. NODES - 1) { run operator(i) }
#endif
        for (i : 0 .. NODES - 1) {
            run machine(i);
#ifdef BELIEFS
            run asking(i);
#endif
#ifdef OLD_COPY
            run medium(i);
#endif
            for (j : 0 .. NODES - 1) {
                if
                :: i != j ->
#ifdef SERIAL
                    run giving(i, j, 0);
#else
                    for (v : 1 .. VERSIONS) { run giving(i, j, v) }
#endif
#ifdef BELIEFS
                    for (v : 1 .. VERSIONS) { run believing(i, v, j) }
#endif
                :: else ->
                    for (v : 1 .. VERSIONS) {
                        run accepting(i, v);
#ifdef GHOST
                        run ghost(i, v)
#endif
                    }
                fi
            }
        }
#ifdef LIVE
        run noise()
#endif
    }
}
#endif
