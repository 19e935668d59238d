// The source of targets that only hold precompiled headers for others.
int main() {}
