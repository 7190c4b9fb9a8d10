/* The loop of a board: it waits for a request, does it, and answers.  Exported by Gapsense; do not edit it.

   A message is a head of 6 bytes, data, and the CRC-32 of both.  On the line it is encoded as COBS, which has no zero,
   and ends with a zero.  So a lost byte damages one message and no other.  Numbers have their least byte first.

       head of a request: what, component, sequence (2), bytes of data (2)
       head of an answer: result, component, sequence (2), bytes of data (2)

   A request with the sequence of the one before is that one, repeated: the board does nothing and answers as before.
   HELLO alone is always new.  What cannot be read is answered by DAMAGED, with no data. */
#include <string.h>

#include "components.h"
#include "loop.h"

/* HELLO:          -> version, most bytes of data, bytes of a number, components, then flash, RAM, stack used [bytes]
   ABOUT: offset   -> that part of the text of a component
   SET:   numbers, and CRC-32 of those that are part of the code
   START: inputs   -> outputs, count
   STEP:  inputs   -> outputs, count
   SAVE:  offset   -> that part of the state
   LOAD:  offset, bytes of the state */
enum { HELLO, ABOUT, SET, START, STEP, SAVE, LOAD };
enum { DONE, DAMAGED, UNKNOWN, NOT_STARTED, OTHER_NUMBERS };
enum { VERSION = 1, HEAD = 6, SUM = 4, ROOM = HEAD + GAPSENSE_DATA + SUM };

static uint8_t request[ROOM], answer[ROOM];
static uint32_t started; /* one bit for each component; a board that was reset has forgotten it */
static uint32_t empty;   /* what the counter counts when nothing is done */

static uint32_t number_at(const uint8_t *from)
{
    return from[0] | (uint32_t)from[1] << 8 | (uint32_t)from[2] << 16 | (uint32_t)from[3] << 24;
}

static void put_number(uint8_t *to, uint32_t value)
{
    for (int k = 0; k < 4; k++) to[k] = (uint8_t)(value >> 8 * k);
}

static uint32_t checksum(const uint8_t *data, uint32_t size)
{
    static const uint32_t table[16] = {
        0x00000000u, 0x1db71064u, 0x3b6e20c8u, 0x26d930acu, 0x76dc4190u, 0x6b6b51f4u, 0x4db26158u, 0x5005713cu,
        0xedb88320u, 0xf00f9344u, 0xd6d6a3e8u, 0xcb61b38cu, 0x9b64c2b0u, 0x86d3d2d4u, 0xa00ae278u, 0xbdbdf21cu,
    };
    uint32_t sum = 0xFFFFFFFFu;
    for (uint32_t k = 0; k < size; k++) {
        sum = table[(sum ^ data[k]) & 15u] ^ sum >> 4;
        sum = table[(sum ^ (uint32_t)data[k] >> 4) & 15u] ^ sum >> 4;
    }
    return ~sum;
}

/* Bytes of the next message, in `request`; more than there is room for if it does not fit; negative at the end. */
static int32_t receive(void)
{
    int32_t size = 0;
    int code = 0, left = 0;
    for (int byte; (byte = gapsense_get()) != 0;) {
        const int is_code = left == 0, is_zero = is_code && code != 0 && code != 255;
        if (byte < 0) return -1;
        if (is_code) code = left = byte;
        left--;
        if (is_code && !is_zero) continue;
        if (size < ROOM) request[size] = is_code ? 0 : (uint8_t)byte;
        size += size <= ROOM;
    }
    return left == 0 ? size : ROOM + 1;
}

static void send(const uint8_t *data, uint32_t size)
{
    uint32_t begin = 0, is_more = 1;
    while (is_more) {
        uint32_t end = begin;
        while (end < size && data[end] != 0 && end - begin < 254) end++;
        is_more = end < size;
        gapsense_put((uint8_t)(end - begin + 1));
        for (uint32_t k = begin; k < end; k++) gapsense_put(data[k]);
        begin = end + (end - begin < 254);
    }
    gapsense_put(0);
}

/* Fill in the head and the sum of a message with its data, and send it. */
static void respond(uint8_t *message, int result, uint32_t component, uint32_t sequence, uint32_t size)
{
    message[0] = (uint8_t)result;
    message[1] = (uint8_t)component;
    message[2] = (uint8_t)sequence;
    message[3] = (uint8_t)(sequence >> 8);
    message[4] = (uint8_t)size;
    message[5] = (uint8_t)(size >> 8);
    put_number(message + HEAD + size, checksum(message, HEAD + size));
    send(message, HEAD + size + SUM);
}

/* How much of the memory and of the stack is used.  The stack is painted first, and looked at later. */
#ifdef __arm__
#define PAINT 0xC0FFEE11u
extern uint32_t stack_top[], data_start[], data_end[], data_load[], flash_start[], bss_end[]; /* of link.ld */

static uint32_t *lowest(const uint32_t *sp)
{
    uint32_t *const from = (uint32_t *)((uintptr_t)sp & ~(uintptr_t)3) - 16384; /* 64 kB at most */
    return from < bss_end ? bss_end : from;
}

static void paint(void)
{
    uint32_t *sp;
    __asm volatile("mov %0, sp" : "=r"(sp));
    for (uint32_t *at = lowest(sp); at < sp - 64; at++) *at = PAINT;
}

static uint32_t stack_used(void)
{
    const uint32_t *at;
    __asm volatile("mov %0, sp" : "=r"(at));
    for (at = lowest(at); at < stack_top && *at != PAINT;) at++; /* of what lies below all that was painted */
    while (at < stack_top && *at == PAINT) at++;
    return (uint32_t)((uintptr_t)stack_top - (uintptr_t)at);
}

static void tell_memory(uint8_t *to)
{
    put_number(to, (uint32_t)((uintptr_t)data_load - (uintptr_t)flash_start + (uintptr_t)data_end - (uintptr_t)data_start));
    put_number(to + 4, (uint32_t)((uintptr_t)bss_end - (uintptr_t)data_start));
    put_number(to + 8, stack_used());
}
#else
static void paint(void) {}

static void tell_memory(uint8_t *to)
{
    memset(to, 0, 12);
}
#endif

static uint32_t hello(uint8_t *data)
{
    put_number(data, VERSION);
    put_number(data + 4, GAPSENSE_DATA);
    put_number(data + 8, GAPSENSE_NUMBER);
    put_number(data + 12, gapsense_components_count);
    tell_memory(data + 16);
    return 28;
}

/* Copy as much of something as fits, from an offset on; its bytes. */
static uint32_t part(uint8_t *to, const void *from, uint32_t size, uint32_t offset)
{
    const uint32_t left = offset < size ? size - offset : 0, count = left < GAPSENSE_DATA ? left : GAPSENSE_DATA;
    memcpy(to, (const uint8_t *)from + (count ? offset : 0), count);
    return count;
}

/* ABOUT begins with the bytes of state and of all records, and with what the counter counts. */
static uint32_t about(uint8_t *data, const gapsense_component *c, uint32_t offset)
{
    const uint32_t unit = (uint32_t)strlen(gapsense_unit) + 1;
    if (offset) return part(data, c->about, (uint32_t)strlen(c->about), offset - 1);
    put_number(data, c->state);
    put_number(data + 4, c->memory);
    memcpy(data + 8, gapsense_unit, unit < 24 ? unit : 24);
    return 8 + (unit < 24 ? unit : 24);
}

static uint32_t timed(uint8_t *data, const gapsense_component *c, void (*function)(void), const uint8_t *inputs)
{
    uint32_t before;
    memcpy(c->at_inputs, inputs, c->inputs);
    before = gapsense_count();
    function();
    put_number(data + c->outputs, gapsense_count() - before - empty);
    memcpy(data, c->at_outputs, c->outputs);
    return c->outputs + 4;
}

/* Do what is asked, and respond. */
static void serve(uint32_t size, uint32_t sequence)
{
    const uint8_t what = request[0], *const given = request + HEAD;
    const gapsense_component *const c = gapsense_components + request[1];
    uint8_t *const data = answer + HEAD;
    const uint32_t bit = request[1] < gapsense_components_count ? 1u << request[1] : 0, offset = number_at(given);
    uint32_t made = 0;
    int result = DONE;
    if (what == HELLO) made = hello(data);
    else if (!bit) result = UNKNOWN;
    else if (what == ABOUT && size == 4) made = about(data, c, offset);
    else if (what == SET && size == c->parameters + 4) {
        if (number_at(given + c->parameters) == c->fixed) c->set(given);
        else result = OTHER_NUMBERS;
    } else if (what == START && size == c->inputs) {
        made = timed(data, c, c->start, given);
        started |= bit;
    } else if (!(started & bit)) result = NOT_STARTED;
    else if (what == STEP && size == c->inputs) made = timed(data, c, c->step, given);
    else if (what == SAVE && size == 4) made = part(data, c->at_state, c->state, offset);
    else if (what == LOAD && size >= 4 && offset <= c->state && size - 4 <= c->state - offset)
        memcpy((uint8_t *)c->at_state + offset, given + 4, size - 4);
    else result = UNKNOWN;
    respond(answer, result, request[1], sequence, made);
}

int main(void)
{
    static uint8_t damaged[HEAD + SUM];
    uint32_t last = 0x10000u; /* no sequence */
    paint();
    gapsense_count();
    empty = gapsense_count();
    empty = gapsense_count() - empty;
    for (int32_t size; (size = receive()) >= 0;) {
        const uint32_t data = (uint32_t)size - HEAD - SUM, sequence = request[2] | (uint32_t)request[3] << 8;
        if (size == 0) continue; /* between two ends */
        if (size < HEAD + SUM || size > ROOM || data != (request[4] | (uint32_t)request[5] << 8) ||
            number_at(request + HEAD + data) != checksum(request, HEAD + data)) {
            respond(damaged, DAMAGED, 0, 0, 0);
        } else if (sequence == last && request[0] != HELLO) {
            send(answer, HEAD + (answer[4] | (uint32_t)answer[5] << 8) + SUM);
        } else {
            serve(data, sequence);
            last = sequence;
        }
    }
    return 0;
}
