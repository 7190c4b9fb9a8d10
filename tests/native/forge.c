/* A host that forges saved states: in turn it changes numbers of one, seals it anew, restores it and goes on.
 *
 * forge LIBRARY GUID RESOURCES TABLE INPUTS OUTPUTS FIRST EVERY [NUMBER...]
 *
 * The first six words are those of host.c. Of the state's content the FIRST numbers are changed one by one, of those
 * behind them each EVERY-th; to the NUMBERs among others, one half of them in the middle of the record and the other one
 * at its end. Prints how many states were taken and how many refused. Built
 * with sanitizers, as the library, it ends at the first wrong access to memory. */
#define main run_table
#include "host.c"
#undef main

#include <math.h>
#include <stdint.h>
#include <string.h>

enum { HEAD = 56, FLAGS = 4, STEPS = 12, MOST_VALUES = 64, TOGETHER = 8 };
static const double LONGEST = 1e-3; /* [s], a step after a forged number: of a longer one, a number meets the same code */


static const char *const SENTENCE = "the saved state is damaged: its ";
static long refused, taken;

static void count_refusal(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                          fmi2String message, ...)
{
    (void)environment, (void)name, (void)status, (void)category;
    refused += strstr(message, SENTENCE) != NULL;
}

/* Seals of a state with each of some words at a place: side by side, since a sum waits for each of its bytes. */
static void sums_of(const unsigned char *bytes, size_t size, size_t at, const uint64_t *tried, int tries, uint64_t *sums)
{
    uint64_t before = 14695981039346656037u;
    for (size_t k = HEAD; k < at; k++)
        before = (before ^ bytes[k]) * 1099511628211u;
    for (int j = 0; j < TOGETHER * ((tries + TOGETHER - 1) / TOGETHER); j += TOGETHER) {
        unsigned char word[TOGETHER][8];
        uint64_t sum[TOGETHER];
        for (int i = 0; i < TOGETHER; i++) {
            memcpy(word[i], tried + (j + i < tries ? j + i : 0), 8);
            sum[i] = before;
        }
        for (int k = 0; k < 8; k++)
            for (int i = 0; i < TOGETHER; i++)
                sum[i] = (sum[i] ^ word[i][k]) * 1099511628211u;
        for (size_t k = at + 8; k < size; k++)
            for (int i = 0; i < TOGETHER; i++)
                sum[i] = (sum[i] ^ bytes[k]) * 1099511628211u;
        for (int i = 0; i < TOGETHER && j + i < tries; i++)
            sums[j + i] = sum[i];
    }
}

static void go_on(fmi2Component c, const Table *t, int row)
{
    double values[MOST];
    const double before = t->times[1] - t->times[0], step = before < LONGEST ? before : LONGEST;
    for (int k = 0; k < STEPS; k++) {
        const int at = (row + k) % t->rows;
        CALL(fmi2SetReal)(c, t->input, (size_t)t->inputs, t->values + at * t->inputs);
        CALL(fmi2DoStep)(c, row * before + k * step, step, fmi2True);
        CALL(fmi2GetReal)(c, t->output, (size_t)t->outputs, values);
    }
}

/* As it is, and with other flags as a state of an earlier phase. */
static void use(fmi2Component c, const Table *t, int row, fmi2FMUstate state, int is_flag)
{
    check(CALL(fmi2SetFMUstate)(c, state), "fmi2SetFMUstate");
    go_on(c, t, row);
    if (!is_flag)
        return;
    check(CALL(fmi2SetFMUstate)(c, state), "fmi2SetFMUstate");
    CALL(fmi2ExitInitializationMode)(c);
    go_on(c, t, row);
    check(CALL(fmi2SetFMUstate)(c, state), "fmi2SetFMUstate");
    CALL(fmi2EnterInitializationMode)(c);
    CALL(fmi2ExitInitializationMode)(c);
    go_on(c, t, row);
}

static void try_bytes(fmi2Component c, const Table *t, int row, unsigned char *bytes, size_t size, int is_flag)
{
    const long before = refused;
    fmi2FMUstate state = NULL;
    if (CALL(fmi2DeSerializeFMUstate)(c, (fmi2Byte *)bytes, size, &state) == fmi2OK) {
        taken++;
        use(c, t, row, state, is_flag);
    } else if (refused != before + 1) {
        fail("a state was refused in other words");
    }
    CALL(fmi2FreeFMUstate)(c, &state);
}

/* True if a word is not among those there are; it is put behind them. */
static int is_new(uint64_t *tried, int tries, const void *word)
{
    memcpy(tried + tries, word, 8);
    for (int k = 0; k < tries; k++)
        if (tried[k] == tried[tries])
            return 0;
    return 1;
}

enum { ALL = -1 };

/* Of each number every second value, by its turn, 0 or 1; or all. */
static void forge(fmi2Component c, const Table *t, int row, size_t first, size_t every, const double *wild, int count,
                  int turn)
{
    fmi2FMUstate state = NULL;
    size_t size = 0;
    check(CALL(fmi2GetFMUstate)(c, &state), "fmi2GetFMUstate");
    check(CALL(fmi2SerializedFMUstateSize)(c, state, &size), "fmi2SerializedFMUstateSize");
    unsigned char *bytes = malloc(size);
    check(CALL(fmi2SerializeFMUstate)(c, state, (fmi2Byte *)bytes, size), "fmi2SerializeFMUstate");
    for (size_t at = HEAD; at + 8 <= size; at += 8 * (at < HEAD + 8 * first ? 1 : every)) {
        double now;
        uint64_t word;
        memcpy(&now, bytes + at, 8);
        memcpy(&word, bytes + at, 8);
        uint64_t tried[2 * MOST_VALUES] = {word};
        int tries = 1;
        const double near[] = {now + 1.0, now - 1.0, now + 0.5, -now, 1024.0 * now};
        for (int k = 0; k < 5 + count; k++)
            tries += is_new(tried, tries, k < 5 ? near + k : wild + k - 5);
        for (uint64_t flag = 0; flag < 6; flag++)
            tries += is_new(tried, tries, &flag);
        if (turn != ALL) {
            int kept = 1;
            for (int k = 1; k < tries; k++)
                if ((k + (int)(at / 8)) % 2 == turn)
                    tried[kept++] = tried[k];
            tries = kept;
        }
        uint64_t sums[2 * MOST_VALUES];
        sums_of(bytes, size, at, tried, tries, sums);
        for (int k = 1; k < tries; k++) {
            memcpy(bytes + HEAD - 8, sums + k, 8);
            memcpy(bytes + at, tried + k, 8);
            try_bytes(c, t, row, bytes, size, at < HEAD + 8 * FLAGS);
        }
        memcpy(bytes + at, &word, 8);
    }
    check(CALL(fmi2SetFMUstate)(c, state), "fmi2SetFMUstate");
    CALL(fmi2FreeFMUstate)(c, &state);
    free(bytes);
}

int main(int count, char **words)
{
    double wild[MOST_VALUES] = {-1.0, 1e9, 2147483648.0, -2.1e9, -2147483649.0, NAN, INFINITY, -INFINITY, 0.5, 1e300};
    int values = 10;
    if (count < 9 || !(library = OPEN(words[1])))
        fail("cannot open the library");
    const Table t = read_table(words[4], atoi(words[5]), atoi(words[6]));
    for (int k = 9; k < count && values < MOST_VALUES; k++)
        wild[values++] = strtod(words[k], NULL);
    fmi2CallbackFunctions functions = {count_refusal, calloc, free, NULL, NULL};
    fmi2Component c = CALL(fmi2Instantiate)("one", fmi2CoSimulation, words[2], words[3], &functions, 0, 1);
    forge(c, &t, 0, 2 * FLAGS, (size_t)atol(words[8]), wild, values, ALL);
    check(CALL(fmi2SetupExperiment)(c, 0, 0.0, t.times[0], 0, 0.0), "fmi2SetupExperiment");
    check(CALL(fmi2EnterInitializationMode)(c), "fmi2EnterInitializationMode");
    check(CALL(fmi2SetReal)(c, t.input, (size_t)t.inputs, t.values), "fmi2SetReal");
    check(CALL(fmi2ExitInitializationMode)(c), "fmi2ExitInitializationMode");
    for (int row = 1; row < t.rows; row++) {
        const double step = t.times[1] - t.times[0];
        check(CALL(fmi2SetReal)(c, t.input, (size_t)t.inputs, t.values + row * t.inputs), "fmi2SetReal");
        check(CALL(fmi2DoStep)(c, (row - 1) * step, step, fmi2True), "fmi2DoStep");
        if (row == t.rows / 2 || row == t.rows - 1)
            forge(c, &t, row, (size_t)atol(words[7]), (size_t)atol(words[8]), wild, values, row == t.rows - 1);
    }
    CALL(fmi2FreeInstance)(c);
    free_table(&t);
    printf("%ld %ld\n", taken, refused);
    return 0;
}
