/* Where the FMU's resources are: the location that the host gives, as a path. Part of shim.c. */

static void percent_decode(char *text)
{
    char *out = text;
    for (const char *in = text; *in; in++) {
        unsigned code;
        char digits[3] = {in[0] == '%' ? in[1] : '\0', in[1] ? in[2] : '\0', '\0'};
        if (strspn(digits, "0123456789abcdefABCDEF") == 2 && sscanf(digits, "%x", &code) == 1 && code) {
            *out++ = (char)code;
            in += 2;
        } else {
            *out++ = *in;
        }
    }
    *out = '\0';
}

/* Without a scheme, `location` is taken for a plain path, as some hosts pass one. */
static int local_path(const char *location, char *path, size_t size, Reason *why)
{
    const char *start = location ? location : "";
    int is_uri = strncasecmp(start, "file:", 5) == 0;
    if (is_uri)
        start += 5;
    if (is_uri && strncmp(start, "//", 2) == 0)
        start += 2 + strcspn(start + 2, "/"); /* the authority: empty or `localhost` */
    int fits = (size_t)snprintf(path, size, "%s", start) < size;
    if (is_uri)
        percent_decode(path);
    if (fits && *path && access(path, R_OK | X_OK) == 0)
        return 1;
    explain(why, "This FMU does not find its resources: the folder `%s` cannot be read (the tool gave the location "
                 "`%s`). Extract the whole FMU again, into a folder that stays while the tool runs.",
            path, location ? location : "");
    return 0;
}
