/* FMI 3.0: what is behind a value reference. */
#include "fmi3_places.h"

static Place of_port(const Port *port)
{
    static const Type types[] = {FLOAT64, INT32, TRUTH, TEXT};
    const Place place = {port->choices ? INT64 : types[port->kind], 1, 0, port, NULL, NULL, NULL};
    return place;
}

Place place_of(unsigned reference)
{
    Place place = {FLOAT64, reference == arrays.time, 0, NULL, NULL, NULL, NULL};
    if (reference < (unsigned)model.port_count)
        return of_port(model.ports + reference);
    for (int k = 0; k < arrays.table_count; k++) {
        const Table *table = arrays.tables + k;
        if (reference - table->rows > (unsigned)model.ports[table->port].head_count)
            continue;
        place.head = (int)(reference - table->rows) - 1;
        place.type = place.head < 0 ? UINT64 : FLOAT64;
        place.table = table;
    }
    for (int k = 0; k < arrays.matrix_count; k++)
        if (arrays.matrices[k].reference == reference)
            place.matrix = arrays.matrices + k;
    if (arrays.motion && reference - arrays.motion->count <= (unsigned)arrays.motion->signal_count) {
        place.motion = arrays.motion;
        place.head = (int)(reference - arrays.motion->count) - 1;
        place.type = place.head < 0 ? INT32 : FLOAT64;
    }
    place.is_there |= place.table || place.matrix || place.motion;
    return place;
}

size_t size_of(const State *s, const Place *place)
{
    if (place->matrix)
        return (size_t)place->matrix->size * (size_t)place->matrix->size;
    if (place->motion)
        return place->head < 0 ? 1 : MOTION_ROWS;
    return place->table && place->head >= 0 ? (size_t)table_rows(s, place->table) : 1;
}

Status check(Instance *i, const char *name, Type type, const unsigned *references, size_t count, size_t values)
{
    static const char *const names[] = {"Float64", "Int32", "Int64 or Enumeration", "UInt64", "Boolean", "String"};
    size_t expected = 0;
    if (type == FLOAT64 && values == count && are_below((unsigned)model.signals, references, count))
        return FINE; /* inputs and outputs are Real: the usual case */
    for (size_t k = 0; k < count; k++) {
        const Place place = place_of(references[k]);
        if (!place.is_there || place.type != type)
            return refuse(i, SAY_NO_VARIABLE, names[type], references[k]);
        expected += size_of(i->state, &place);
    }
    if (expected != values)
        return refuse(i, SAY_VALUE_COUNT, name, (unsigned)expected, (unsigned)values);
    return FINE;
}

int are_below(unsigned limit, const unsigned *references, size_t count)
{
    int below = 1;
    for (size_t k = 0; k < count; k++)
        below &= references[k] < limit;
    return below;
}

int are_scalars(const unsigned *references, size_t count)
{
    return are_below((unsigned)model.port_count, references, count);
}

void add_name(Text *text, const Place *place)
{
    if (!place->table) {
        text_add(text, "%s", place->matrix ? place->matrix->name : place->motion ? "smoothed_motion" : "time");
        return;
    }
    const Port *port = model.ports + place->table->port;
    text_add(text, "%s.%s", port->name, place->head < 0 ? "rows" : port->heads[place->head].name);
}
