/* One call among MACHINES participants and an initiator: the model of participant.py and initiator.py, checked by SPIN.
 *
 * Each receiver may miss a frame that others hear, LOSSES times in all; what is not lost may come twice. Frames arrive
 * before the deadline that their senders meant them for, or not at all: no bid is sent within two guards of the
 * deadline. Every machine passes the deadline by its own clock. Machines are alike, so lower numbers are better bids.
 *
 * Variants: SILENT_AWARD is the seed papers' form (Pujo, Ounnar, Zanni: at the deadline everybody knows the winner).
 * ONE_AWARD plants a bug, an award that is never repeated. TRACE leaves out the processes (see token.pml).
 * Not modelled: options of sub-calls, several attempts at one task as one, crashes.
 */
#ifndef MACHINES
#define MACHINES 3
#endif
#ifndef LOSSES
#define LOSSES 3
#endif

/* States of a participant; WAITING is all of WAITING_BOUND, WAITING_COST and ASKING. */
#define WAITING 0
#define PRE_ASSIGNED 1
#define SILENT 2
#define BELIEVING 3
#define LAPSED 4
#define ASSIGNED 5
#define LOST 6
/* States of the initiator. */
#define OPEN 0
#define AWARDING 1
#define CLOSED 2
/* A bid on its way to one receiver. */
#define NO_BID 0
#define ON_BUS 1
#define HEARD 2
#define MISSED 3

#define NOBODY 255
#define INITIATOR MACHINES
#define TO(receiver, bidder) ((receiver) * MACHINES + (bidder))

byte state[MACHINES];
bool has_bid[MACHINES];
byte rank[MACHINES];
byte best[MACHINES + 1];
byte bids[TO(MACHINES + 1, 0)];
/* How many bids are on their way to each receiver: it passes the deadline when they are there, or missed. */
byte on_way[MACHINES + 1];
bool somebody_passed;
byte stage;
/* The award, or the closing for nobody, on its way to each machine; the winner's itinerary on its way back. */
bool said[MACHINES];
byte winner;
bool acting;
byte losses;

byte k_;

inline alone(i) {
    k_ = 0;
    do
    :: k_ < MACHINES -> assert(k_ == i || state[k_] != ASSIGNED); k_++
    :: k_ >= MACHINES -> break
    od;
    k_ = 0
}

inline say_closing() {
    k_ = 0;
    do
    :: k_ < MACHINES -> said[k_] = true; k_++
    :: k_ >= MACHINES -> break
    od;
    k_ = 0
}

inline bid(i) {
    atomic {
        state[i] == WAITING && !somebody_passed && stage == OPEN && (best[i] == NOBODY || rank[i] < rank[best[i]]);
        state[i] = PRE_ASSIGNED; has_bid[i] = true; best[i] = i;
        k_ = 0;
        do
        :: k_ <= INITIATOR && k_ == i -> k_++
        :: k_ <= INITIATOR && k_ != i -> bids[TO(k_, i)] = ON_BUS; on_way[k_] = on_way[k_] + 1; k_++
        :: k_ > INITIATOR -> break
        od;
        k_ = 0
    }
}

inline quiet(i) {
    atomic { state[i] == WAITING; state[i] = SILENT }
}

inline hear_bid(receiver, bidder) {
    atomic {
        bids[TO(receiver, bidder)] == ON_BUS || bids[TO(receiver, bidder)] == HEARD;
        if
        :: bids[TO(receiver, bidder)] == ON_BUS -> on_way[receiver] = on_way[receiver] - 1
        :: else
        fi;
        bids[TO(receiver, bidder)] = HEARD;
        if
        :: best[receiver] == NOBODY || rank[bidder] < rank[best[receiver]] -> best[receiver] = bidder
        :: else
        fi;
        if
        :: receiver != INITIATOR && state[receiver] == PRE_ASSIGNED && best[receiver] != receiver -> state[receiver] = SILENT
        :: else
        fi
    }
}

inline miss_bid(receiver, bidder) {
    atomic {
        bids[TO(receiver, bidder)] == ON_BUS && losses < LOSSES;
        bids[TO(receiver, bidder)] = MISSED; on_way[receiver] = on_way[receiver] - 1; losses++
    }
}

inline deadline(i) {
    atomic {
        state[i] == PRE_ASSIGNED && on_way[i] == 0;
        somebody_passed = true;
#ifdef SILENT_AWARD
        state[i] = ASSIGNED; alone(i)
#else
        state[i] = BELIEVING
#endif
    }
}

inline lapse(i) {
    atomic { state[i] == BELIEVING; state[i] = LAPSED }
}

inline decide() {
    atomic {
        stage == OPEN && best[INITIATOR] != NOBODY && on_way[INITIATOR] == 0;
        somebody_passed = true; winner = best[INITIATOR];
#ifdef SILENT_AWARD
        stage = CLOSED
#else
        stage = AWARDING; say_closing()
#endif
    }
}

inline close_empty() {
    atomic {
        stage == OPEN && best[INITIATOR] == NOBODY && on_way[INITIATOR] == 0;
        somebody_passed = true; stage = CLOSED; say_closing()
    }
}

inline withdraw() {
    atomic { stage == OPEN; stage = CLOSED; somebody_passed = true; say_closing() }
}

inline award_again() {
    atomic { stage == AWARDING; say_closing() }
}

inline hear_closing(i) {
    atomic {
        said[i];
        if
        :: winner == i && has_bid[i] && state[i] != LOST -> state[i] = ASSIGNED; alone(i)
        :: winner != i && state[i] != ASSIGNED -> state[i] = LOST
        :: else
        fi
    }
}

/* The winner's firm itinerary, or its report; said again for whoever misses it. */
inline act(i) {
    atomic { state[i] == ASSIGNED; acting = true }
}

inline heard_acting() {
    atomic { stage == AWARDING && acting; stage = CLOSED }
}

inline given_back() {
    atomic { stage == AWARDING && state[winner] == ASSIGNED; stage = CLOSED }
}

/* The winner is lost, or not heard: the custodian of the object closes the call and opens another under a raised version.
 * That the old winner cannot have the object is the tokens' part (token.pml). */
inline abandon() {
    atomic { stage == AWARDING; stage = CLOSED }
}

/* A newer call for the same task, which comes after the end of this one. */
inline superseded(i) {
    atomic { stage == CLOSED && state[i] != ASSIGNED; state[i] = LOST }
}

inline expect(i, wanted) {
    (state[i] == wanted)
}

inline begin() {
    k_ = 0;
    do
    :: k_ < MACHINES -> rank[k_] = k_; best[k_] = NOBODY; k_++
    :: k_ >= MACHINES -> break
    od;
    best[INITIATOR] = NOBODY; winner = NOBODY; k_ = 0
}

#ifndef TRACE

#define OVER(i) (state[i] == ASSIGNED || state[i] == LOST)

proctype participant(byte i) {
end:
    do
    :: bid(i)
    :: quiet(i)
    :: deadline(i)
    :: lapse(i)
    :: atomic { said[i] && !OVER(i) -> hear_closing(i) }
    :: atomic { state[i] == ASSIGNED && !acting -> act(i) }
    od
}

/* A bid on its way: to a receiver that it reaches, or not. */
proctype carrying(byte receiver, bidder) {
end:
    do
    :: atomic { bids[TO(receiver, bidder)] == ON_BUS -> hear_bid(receiver, bidder) }
    :: miss_bid(receiver, bidder)
    od
}

proctype missing(byte i) {
end:
    do
    :: atomic { said[i] && losses < LOSSES -> said[i] = false; losses++ }
    :: atomic { acting && losses < LOSSES -> acting = false; losses++ }
    od
}

proctype initiator() {
end:
    do
    :: decide()
    :: close_empty()
#ifndef ONE_AWARD
    :: atomic { stage == AWARDING && !said[winner] -> award_again() }
#endif
    :: heard_acting()
    od
}

#ifndef SILENT_AWARD
ltl closes { <> (stage == CLOSED && (winner == NOBODY || state[winner] == ASSIGNED)) }
#endif

init {
    byte i, j;
    atomic {
        begin();
        for (i : 0 .. MACHINES - 1) {
            run participant(i); run missing(i);
            for (j : 0 .. MACHINES) {
                if
                :: i != j -> run carrying(j, i)
                :: else
                fi
            }
        }
        run initiator()
    }
}
#endif
