#include "heads.h"

#include <string.h>

#include "sentences.h"

typedef struct {
    const Port *port;
    const Csv *csv;
    int *places;
    Text *problems;
} Search;

/* A cell of the header, taken apart; the parts are not ended by zeros. */
typedef struct {
    const char *name, *unit;
    int name_length, unit_length;
} Title;

static void strip(const char **text, int *length)
{
    size_t n;
    while (*length && (n = space(*text))) {
        *text += n;
        *length -= (int)n;
    }
    for (int back = 1; back <= 3 && back <= *length; back++)
        if (space(*text + *length - back) == (size_t)back) {
            *length -= back;
            back = 0;
        }
}

/* `name [unit]` or `name (unit)`, also `kind:name [unit]`; a text with other brackets is a name as a whole. */
static Title title_of(const char *cell)
{
    const char *colon = strrchr(cell, ':'), *name = colon ? colon + 1 : cell, *unit;
    Title title = {name, "", (int)strcspn(name, "[]()"), 0}, whole = {name, "", (int)strlen(name), 0};
    const char *open = name + title.name_length;
    strip(&title.name, &title.name_length);
    if (!*open)
        return title;
    int length = (int)strlen(open) - 1;
    unit = open + 1;
    strip(&unit, &length);
    if (*open == ']' || *open == ')' || !length || !strchr("])", unit[length - 1]))
        return whole;
    length--;
    strip(&unit, &length);
    title.unit = unit;
    title.unit_length = length;
    return memchr(unit, '\n', (size_t)length) ? whole : title;
}

static int is_called(const Title *title, const char *name)
{
    if ((int)strlen(name) != title->name_length)
        return 0;
    for (int k = 0; k < title->name_length; k++) {
        const char c = title->name[k];
        if ((c >= 'A' && c <= 'Z' ? c + 'a' - 'A' : c) != name[k])
            return 0;
    }
    return 1;
}

static void note_unit(Search *r, const Head *head, const Title *title)
{
    Text found = {NULL, 0, 0};
    if (!*head->unit || !title->unit_length)
        return;
    if ((int)strlen(head->unit) == title->unit_length && !strncmp(head->unit, title->unit, strlen(head->unit)))
        return;
    for (int k = 0; k < title->unit_length; k++)
        text_add(&found, "%s", (char[2]){title->unit[k], 0});
    text_cut(&found, LONGEST_CELL);
    text_join(r->problems, "; ", SAY_COLUMN_UNIT, head->name, text_of(&found), head->unit);
    text_free(&found);
}

static void find_column(Search *r, int h)
{
    const Head *head = r->port->heads + h;
    Text places = {NULL, 0, 0};
    int found = 0;
    r->places[h] = -1;
    for (int k = 0; r->csv->row_count && k < r->csv->rows[0].count; k++) {
        const Title title = title_of(csv_cell(r->csv, 0, k));
        if (!is_called(&title, head->name))
            continue;
        text_join(&places, " and ", "%d", k + 1);
        if (!found++)
            r->places[h] = k;
    }
    text_cut(&places, LONGEST_LIST);
    if (found > 1) {
        text_join(r->problems, "; ", SAY_COLUMNS_TWICE, text_of(&places), head->name);
    } else if (found) {
        const Title title = title_of(csv_cell(r->csv, 0, r->places[h]));
        note_unit(r, head, &title);
    }
    text_free(&places);
}

/* The cells of the header, as a message shows them. */
static void add_header(const Search *r, Text *text)
{
    for (int k = 0; r->csv->row_count && k < r->csv->rows[0].count; k++) {
        const char *cell = csv_cell(r->csv, 0, k);
        int length = (int)strlen(cell);
        strip(&cell, &length);
        if (k)
            text_add(text, ", ");
        for (int c = 0; c < length; c++)
            text_add(text, "%s", (char[2]){cell[c], 0});
    }
    text_cut(text, LONGEST_LIST);
    if (!text->length)
        text_add(text, SAY_NO_HEADER);
}

int find_columns(const Port *port, const Csv *csv, int *places, Text *problems)
{
    Search search = {port, csv, places, problems}, *r = &search;
    Text missing = {NULL, 0, 0}, header = {NULL, 0, 0};
    for (int h = 0; h < r->port->head_count; h++)
        find_column(r, h);
    for (int h = 0; h < r->port->head_count; h++)
        if (r->places[h] < 0)
            text_join(&missing, ", ", "%s", r->port->heads[h].text);
    const int all = missing.length == 0;
    add_header(r, &header);
    if (!all)
        text_join(r->problems, "; ", SAY_COLUMN_MISSING, text_of(&missing), text_of(&header));
    text_free(&missing);
    text_free(&header);
    return all;
}
